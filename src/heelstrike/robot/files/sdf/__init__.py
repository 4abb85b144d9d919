"""Gazebo's format for models, read into MJCF, from where robots of all formats are read alike."""
