"""The solvers of the control problem, and the fallbacks if they find no plan.

fallbacks      what is tried one after another, down to full braking
solver_pool    solvers for different numbers of people and walls, built before they are needed
sqp            a condensed SQP: `Sqp`
sqp_functions  the CasADi functions that the SQP evaluates
ipopt          IPOPT, as in the paper: `Ipopt`
"""
