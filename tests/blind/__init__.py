"""Hidden-effect tests of `gyrotc diagnose`: an independent generator of recordings, and a grader.

Nothing here imports gyrotc. Physics, operators, noise and maps are written a second time, by other
methods, so that an error of the tool cannot hide behind the same error in its test.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
