"""Every file that comes in or goes out.

- In: ``incoming`` (the one opener), ``archives``, ``yaml_text``; out: ``outgoing`` (the one writer), ``unfinished``.
- Formats: ``rosmap`` and its ``map_picture``, ``geojson``, ``tum``.
"""
