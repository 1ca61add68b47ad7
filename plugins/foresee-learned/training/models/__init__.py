"""The networks of the learned drivers, in torch: `fusion` in TransFuser's role, `fusion_safe` in InterFuser's."""
