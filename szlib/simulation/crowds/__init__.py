"""People who react to the robot and to each other, by interchangeable models of walking."""

from .reacting import MODELS, ReactingPeople
