"""Pages and test cards of designed inputs.

Read documents, page, tables, figures, test_card; classic_page is for classic inputs.
"""
