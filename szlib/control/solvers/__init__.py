"""How the problem is solved, and what is done where it is not.

ipopt     by IPOPT, as in the paper
program   what the SQP works with: derivatives by the structure of the problem
sqp       by a condensed SQP
sizes     a solver for any number of people and walls, built ahead of the need
ladder    what is tried one after another, down to full braking
"""
