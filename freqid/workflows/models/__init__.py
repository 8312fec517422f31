"""From flights to models: sensors checked, one condition identified, several blended, one predicted.

Read `sensors`, `identify`, `output_error`, `frequency_response`, `blend`, `advance_ratio`.
"""
