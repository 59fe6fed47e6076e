"""The paper repeated: its experiment on simulated recordings, its table and its figures (`make paper`).

Ding, Zhang, Huang and Chen, "Laser Gyro Temperature Compensation Using Modified RBFNN", Sensors 2014.
"""
