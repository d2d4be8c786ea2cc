"""What the environments ask for: a task knows goal, reward, success and end, and no Gymnasium."""
