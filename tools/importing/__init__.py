"""`lindy import`: a log that another program wrote becomes a recording.

command        the verb: which file by which map into which folder
map_file       which field of which message is which of ours
quantities     units, and what a value can be
choosing       which messages of a log a map takes: pure
conversion     rows of a log to messages, by the map: pure
oddities       what was odd in them, counted: pure
board_offset   a board's clock against the logger's: pure
contradictions what the sensors of a log say of each other: pure
log_file       what a format's reader gives
rosbag_file    bags of ROS 1 and ROS 2
mcap_file      recordings of other programs
dataflash_file logs of ArduSub
tlog_file      logs of a ground station
ulog_file      logs of PX4
table_file     tables
columns        rows of what has columns: pure
several_files  several of one dive
new_recording  the recording as a dive's recorder writes it
"""
