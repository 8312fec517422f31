"""From a manoeuvre to a point model; sees only what an aircraft would log."""
