"""Fitting what a procedure learns from simulated fields: the network of the stellarity index."""

from survey_mc.train.stellarity import TrainedNetwork, train_stellarity

__all__ = ["TrainedNetwork", "train_stellarity"]
