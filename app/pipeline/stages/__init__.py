"""The stages of a run: functions from messages to messages, each in a process of its own or all in one."""
