"""Which experiment to do next: flights and ground tests that separate what a diagnosis leaves possible.

Read `rivals` (what remains and how far apart it is), `excitations`, `predicted_flight`, `next_flight`,
`ground_tests`, then `next_test`, which ranks them. Nothing here looks at data that were not diagnosed yet.
"""
