"""Stories: the events of a run in sentences, derived from its trace."""

from foresee_dsl.story.story import ContactClass, Moment, Story
from foresee_dsl.story.telling import tell

__all__ = ["ContactClass", "Moment", "Story", "tell"]
