"""`dask worker … --preload tests.falsework.tiny_worker`: a worker of a standing cluster that has the tiny stages."""

from tests.falsework.tiny_chain import use_tiny_stages

use_tiny_stages()
