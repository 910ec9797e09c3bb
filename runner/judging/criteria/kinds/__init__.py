"""The criteria: functions of a drive that `@criterion` registers, in a file for each family.

Adding one takes a function in the file of its family, or in a file of its own.
"""
