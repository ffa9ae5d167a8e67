"""Pressure, IMU and magnetometer become `VehicleState`: depth, attitude and two headings."""
