"""Pages, figures on the terminal and test cards of designed inputs; the design is made in design.

Read page, tables, figures, signal_pictures, flight_plan, test_card, summary; classic_page for classic inputs.
"""
