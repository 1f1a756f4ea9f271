"""The rules of the kitchen: numpy and numba, nothing else."""
