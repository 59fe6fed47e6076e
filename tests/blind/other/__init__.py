"""A second blind world, no sibling of the tool: heat by finite volumes, relays, drawn operators.

Nothing here imports the package under test, nor the physics of `tests.blind`
(tests/cases/repository/test_blind_other.py checks it): what the tool knows of gyros it cannot have learnt here, and
what is drawn here it was not written after.
"""
