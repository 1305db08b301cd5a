"""Power cuts by replay: what a process does to a folder is recorded call by call, and every state in which a power cut
may leave the disk is rebuilt (the method of ALICE, OSDI 2014, and CrashMonkey, OSDI 2018).
"""
