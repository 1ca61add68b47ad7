"""The steps of a campaign, a class each: its key, what a worker does, what follows from it, how it is stored.

A new step is a module here with a class of `Step`; `campaign.stages.STEPS` finds it. A step's key contains a hash of
all the code that its module imports: a step imports what it runs and nothing else.
"""
