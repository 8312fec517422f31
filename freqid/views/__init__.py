"""What a result looks like: its page, its table, its figure, and how a notebook shows it.

The one place that knows both the whole jobs (`freqid.workflows`) and what draws (`freqid.report`, pandas,
matplotlib), so that neither of them knows the other. Nothing is computed here beyond what is drawn. Read
`page`, then `notebook`.
"""
