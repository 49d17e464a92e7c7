"""People who react to the robot and to each other, by three interchangeable models of walking."""

from .reacting import MODELS, ReactingPeople
