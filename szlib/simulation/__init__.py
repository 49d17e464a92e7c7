"""What happens then: the robot among people, in the paper's scenarios and in random worlds.

scenario     a scene, what is claimed of it, and what people do: `Scenario`
crowds       people who react, and people who were recorded
controllers  what a controller and a robot must have to drive here, and baselines
metrics      a run in numbers: its motion, how it ended, how social it was
log          the log of a run: its table, metrics, pictures, file: `SimulationLog`
closed_loop  the robot among people, step by step: `simulate`
scenarios    the paper's four scenarios, eleven meetings, random worlds: `SCENARIOS`, `MEETINGS`
rollouts     thousands of them, in parallel: `rollouts`
comparisons  zones, formulations, behaviours and controllers on identical worlds
"""
