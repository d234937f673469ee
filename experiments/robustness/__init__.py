"""How mapping noise moves the prediction: ``sweep`` goes over its sources, one at a time and together.

``levels`` are the settings, ``drives`` what the robot saw, ``trial`` one building under all of them with worse doors
(``door_noise``) and, for repair, ``clean_walls``. ``onset`` tells what gives first; ``report`` and ``figures`` show it.
"""
