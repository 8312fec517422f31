"""What flows between folders: records, vehicles, scenarios, models, units, files, errors; no algorithms."""
