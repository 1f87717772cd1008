# Runs in Godot 3: plays the one animation of a scene and tells where the bones are in the world at some moments.
# Arguments after "--scene": the scene, the moments as JSON, a file to write.
extends SceneTree


func _init():
	var arguments = Array(OS.get_cmdline_args())
	var at = arguments.find("--scene")
	var scene = load(arguments[at + 1]).instance()
	get_root().add_child(scene)
	var player = of_class(scene, "AnimationPlayer")[0]
	var animation = player.get_animation_list()[0]
	player.play(animation)
	var moments = []
	for moment in parse_json(arguments[at + 2]):
		player.seek(moment, true)
		var told = {}
		for skeleton in of_class(scene, "Skeleton"):
			var joints = []
			for bone in range(skeleton.get_bone_count()):
				var pose = skeleton.get_global_transform() * skeleton.get_bone_global_pose(bone)
				joints.append([skeleton.get_bone_name(bone), pose.origin.x, pose.origin.y, pose.origin.z])
			told[str(scene.get_path_to(skeleton))] = joints
		moments.append(told)
	var file = File.new()
	file.open(arguments[at + 3], File.WRITE)
	file.store_string(
		to_json(
			{
				"animations": Array(player.get_animation_list()),
				"length": player.get_animation(animation).length,
				"meshes": of_class(scene, "MeshInstance").size(),
				"moments": moments
			}
		)
	)
	file.close()
	quit()


func of_class(node, name):
	var found = [node] if node.is_class(name) else []
	for child in node.get_children():
		found += of_class(child, name)
	return found
