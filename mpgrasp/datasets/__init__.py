"""Real grasping datasets on disk: Cornell and Jacquard, as labelled images behind one interface."""
