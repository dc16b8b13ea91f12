"""Recordings read without ROS: raw channels, columns of CDR messages, typed series on one time axis."""
