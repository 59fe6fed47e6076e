"""The experiment of the paper on simulated recordings, its table and its figures (`make paper`)."""
