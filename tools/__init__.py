"""What builds, checks and tries this repository; nothing of it is shipped."""
