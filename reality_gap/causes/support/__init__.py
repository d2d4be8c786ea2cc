"""Support: functions that several causes share."""
