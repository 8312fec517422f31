"""Numerical pieces that several folders need: quadrature, finite differences, small statistics."""
