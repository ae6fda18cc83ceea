"""Maps and the files they load from: GridMap, BarrierMap, map_server, MovingAI, datasets."""
