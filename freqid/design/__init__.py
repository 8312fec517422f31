"""Before the flight: what is to be flown, and what it will buy; nothing here reads a record.

Read multisine, finish, forecast, classic, export.
"""
