"""What results are held against, and what follows: a simulation's truth, a sealed effect, the review of a set."""
