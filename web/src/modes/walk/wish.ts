import type { WishMessage } from "../../protocol";

/** Anything that can be wished of the walker. */
export type Wish = WishMessage["wish"];
