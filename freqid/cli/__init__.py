"""The commands, one short module each; heavy imports happen inside the commands."""
