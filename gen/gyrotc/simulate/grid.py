"""The grid on which a run is simulated, and the temperature at which a scenario's parameters hold."""

CELL_S = 1.0  # s: physics and noise are computed once a cell; rows are whole cells or whole parts of one
REFERENCE_C = 20.0  # C: room temperature
