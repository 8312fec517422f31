"""One kind of log a file; each holds its `READER`, and `freqid.flightlog.read` lists them.

`extras` imports the libraries that only some kinds need. What is done with what was read is not here.
"""
