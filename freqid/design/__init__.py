"""Before the flight: what is to be flown, and what it will buy."""
