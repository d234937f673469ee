"""The simulated world, its robot, lidar, odometry and door sightings."""
