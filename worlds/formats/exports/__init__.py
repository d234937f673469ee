"""Floor plans written for other programs: ``sdf`` for Gazebo, ``stage`` for Stage, ``mesh`` as OBJ and URDF."""
