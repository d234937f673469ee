"""What a running program needs beside its work.

Lazy public faces (``lazy``), packages that are missing (``packages``), signals (``stopping``), checks of ``options``.
"""
