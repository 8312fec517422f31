"""What results are held against, and what follows: truth, sealed effects, Monte Carlo campaigns, reviews."""
