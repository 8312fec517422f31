"""Whole jobs: from files or objects to a result, one job a file; what the commands and the public API call.

Nothing here parses words of a command line, prints, or draws: `freqid.cli` and `freqid.views` do. Read
`inputs` first, then the jobs in the order of work: `design`, `fly`, `import_log`, `sensors`, `identify`,
`frequency_response`, `blend`, `connect`, `diagnose`, `compare`, `study`; `files` reads and saves results.
"""
