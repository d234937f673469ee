"""Scan matching: where a scan fits the map.

``scan_matcher`` decides between the two searches: ``gauss_newton_matcher`` refines a guess on the ``likelihood_field``,
``correlative_matcher`` tries a whole window (``block_maxima`` bounds it), ``heading_search`` turns first,
``relocalisation`` finds a lost robot.
"""
