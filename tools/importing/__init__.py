"""`lindy import`: a log that another program wrote becomes a recording.

command        the verb: which file by which map into which folder
map_file       which field of which message is which of ours, in which unit
conversion     a log to messages, by the map: pure
streams        what a log says, as columns: pure
clocks         the logger's clock, and a board's against it: pure
contradictions what the sensors of a log say of each other: pure
oddities       what was odd, counted: pure
log_file       what a format's reader gives, and which of it a map takes
*_file         bags of ROS 1 and ROS 2, recordings of other programs, logs of ArduSub, of a ground
               station and of PX4, tables
several_files  several of one dive
new_recording  the recording as a dive's recorder writes it
"""
