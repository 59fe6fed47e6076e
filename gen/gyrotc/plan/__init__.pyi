from .sensitivity import Sensitivity as Sensitivity
from .sensitivity import programme_of as programme_of
