"""What design, identification, blending and diagnosis give, each with its file; nothing is computed here.

Read design, point, corridor, frequency_response; then diagnosis, gap, gap_self_test and rivals;
judged holds what results are held against.
"""
