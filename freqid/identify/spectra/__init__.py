"""Sampled channels as transforms, trends and smooth derivatives; what the channels mean is not known here.

Read fourier, trend, smoothing.
"""
