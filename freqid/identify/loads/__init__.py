"""From measured motion to the applied wrench and the variables that explain it; nothing is fitted here.

Read wrench, then mass and momentum below it, and explanatory.
"""
