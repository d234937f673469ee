"""What all scores say together, as tables, pictures and one page: ``report`` writes them.

``score_summary`` has the tables, ``paper_numbers`` those of the paper's text beside ours; ``figures`` draws curves,
``sample_pictures`` single maps.
"""
