"""What an exported Python file evaluates its model with: numpy alone, one kind of model a file.

`freqid.blend.exports.python_file` puts the model and the text of one of these into a file. Nothing of freqid
is imported here, and freqid imports nothing from here.
"""
