"""Accuracy against time: the discretisations of one scene run, measured and weighed."""
