"""What design, identification, blending and diagnosis give, and how it is stored; nothing is computed.

Read point, corridor, design, frequency_response, diagnosis and rivals; each has its file beside it.
"""
