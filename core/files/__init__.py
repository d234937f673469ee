"""Every file that comes in or goes out.

- In: ``incoming`` (the one opener), ``archives``, ``yaml_text``.
- Out: ``outgoing`` (the one writer) and ``output_folders``; ``unfinished`` is what killed processes leave.
- Formats: ``rosmap/``, ``geojson/`` and ``tum``.
"""
