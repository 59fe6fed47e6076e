from .planning import HOLDS as HOLDS
from .planning import RATES as RATES
from .planning import Price as Price
from .planning import hours_of as hours_of
from .planning import inputs_of as inputs_of
from .planning import next_run as next_run
from .planning import plan_with_lot as plan_with_lot
from .planning import programme_text as programme_text
