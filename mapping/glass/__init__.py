"""Panes of glass, found by the angle at which beams return from them.

``scan_view`` tells of scans whether their beams went past a place, ``met_surfaces`` which surfaces scans met and how,
``testimony`` what keyframes say about them, ``panes`` what may be glass, ``pane_lines`` joins that to lines and lets
them go on up to the wall, ``before_glass`` ends beams there, ``leaks`` removes what slips past.
"""
