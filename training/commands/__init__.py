"""Commands that train and measure models; thin wrappers around `training`."""
