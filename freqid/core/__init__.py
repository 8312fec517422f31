"""What flows between folders: records, vehicles, scenarios, models, units, files, errors; no algorithms.

Read arrays, channels, units, record, vehicle, scenario with its sections, results, store.
"""
