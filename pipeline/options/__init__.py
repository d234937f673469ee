"""Options of the commands, a file each, named like its command: what tyro turns into the command line.

They import nothing heavy, so that ``--help`` is quick.
"""
