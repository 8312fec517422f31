"""Whole jobs: from files or objects to a result, one job a file; what the commands and the public API call.

Nothing here parses words of a command line, prints, or draws: `freqid.cli` and `freqid.views` do. Read
`inputs` first, then the jobs in the order of work: `scenarios`, `design`, `fly`, `import_log`, `quicklook`,
`models`, `connect`, `diagnose`, `compare`, `studies`; `files` reads and saves results.
"""
