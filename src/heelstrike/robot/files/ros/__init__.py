"""What robot files take from ROS: macros of xacro, transmissions and ros2_control."""
